"""Scores of finished runs by the rules of Euro NCAP, UN R152 and the SmartMOT paper."""
