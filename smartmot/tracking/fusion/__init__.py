"""Several detectors with rates, delays and trust of their own into one tracker."""
