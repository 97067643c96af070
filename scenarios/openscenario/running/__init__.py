"""The engine: storyboard, actions, conditions, actors."""
