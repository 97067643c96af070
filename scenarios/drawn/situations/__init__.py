"""What drawn scenes are about, and who takes part."""
