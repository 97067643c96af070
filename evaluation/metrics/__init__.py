"""Numbers from runs and recordings: matching and accuracy of tracks, forecasts, criticality, intervals."""
