"""Values that depend on others: tables, functions of the temperature."""
