"""Actions that drive entities: sideways, by controllers."""
