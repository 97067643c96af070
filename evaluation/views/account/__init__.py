"""What a run came to and why, in words: every number is read from its log or from its setup."""
