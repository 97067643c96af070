"""Tracking on recorded data: readers, writers, metrics, forecast quality and films. See docs/mot.md.

Packages that only some of this needs (trackeval, matplotlib) are imported where they are used.
"""
