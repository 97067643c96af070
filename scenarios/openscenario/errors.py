"""Errors of the OpenSCENARIO package.

Every message is one line: file and line where it applies, the element, what is wrong and what to do.
"""

from __future__ import annotations

from scenarios.errors import ScenarioError


class OpenScenarioError(ScenarioError):
    """Base of every error raised by this package."""


class FileReadError(OpenScenarioError):
    """A file cannot be opened, is not well-formed XML, or is not OpenSCENARIO 1.0 to 1.3."""


class ContentError(OpenScenarioError):
    """An element or attribute is missing, or has a value that it cannot have."""


class UnsupportedError(OpenScenarioError):
    """The file uses an element, attribute or value that is unknown or not carried out by this engine."""


class ExpressionError(OpenScenarioError):
    """An expression cannot be evaluated."""


class ParameterError(OpenScenarioError):
    """A parameter or variable is unknown, circular, of the wrong type, or breaks its constraints."""


class ConstraintError(ParameterError):
    """A parameter breaks its constraints."""


class CatalogError(OpenScenarioError):
    """A catalog or an entry of it cannot be found."""


class RunError(OpenScenarioError):
    """The scenario is well-formed but cannot be carried out: a position off the road, no way for a route."""
