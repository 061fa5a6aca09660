"""Contact events: closures of gaps predicted within one step."""
