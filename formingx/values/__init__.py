"""Constants that depend on another quantity: tables, functions of the temperature; intervals of fitted constants."""
