"""Settings for an error or a budget, from tables of measured runs."""
