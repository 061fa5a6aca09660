"""Heat conduction through the thickness of sheets in three dimensions."""
