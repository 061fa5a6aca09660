"""Contact events: several gap closures in one step, predicted one after the other.

This extension sets the event predictor of `contact.step_limit`. Without it, each step ends where the gap of a sticking
point closes.
"""

from ...contact.step_limit import StepLimit
from .prediction import ContactEventPredictor

StepLimit.make_predictor = ContactEventPredictor
