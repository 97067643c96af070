"""What perception takes from a map: strips of lanes, the route, regulatory elements."""
