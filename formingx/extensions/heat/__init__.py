"""Heat: conduction in a sheet over time, what its faces give and take, tools that it touches."""
