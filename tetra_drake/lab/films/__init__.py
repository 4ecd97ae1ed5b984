"""Videos of replay pages."""
