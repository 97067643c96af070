"""Named by runs.json: importing it is code of a results folder that runs."""

raise AssertionError("code of a results folder was run")
