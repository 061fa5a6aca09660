"""Contact of a face with a rigid tool: contact points, tractions, history variables and limits of the step length."""
