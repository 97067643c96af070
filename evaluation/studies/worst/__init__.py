"""The search for the case that just fails: how rare a failure is, and where it begins."""
