"""The diagnosis, measured on made and real recordings."""
