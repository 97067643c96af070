"""Scenes that are drawn at random on any map, each proved before it is kept."""
