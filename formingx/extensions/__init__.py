"""Extensions of the core; each folder can be taken out."""
