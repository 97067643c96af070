"""Numbers from runs and recordings: tracking metrics, criticality, intervals."""
