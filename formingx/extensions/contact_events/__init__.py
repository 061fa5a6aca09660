"""Contact events: several gap closures in one step, predicted one after the other.

It extends `contact.step_limit`. Without it, each step ends where a sticking point touches.
"""

from ...contact.step_limit import StepLimit
from .prediction import ContactEventPredictor

StepLimit.make_predictor = ContactEventPredictor
