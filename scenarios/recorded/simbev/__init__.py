"""SimBEV's layout: data sets made with CARLA, read and written."""
