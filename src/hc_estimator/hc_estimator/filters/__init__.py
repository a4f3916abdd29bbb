"""The filters, one file each, and their registry."""
