"""What do false activations cost?"""

from evaluation.studies.answers.severity.question import RULES, Severity
from evaluation.studies.answers.severity.runs import Weights

__all__ = ["RULES", "Severity", "Weights"]
