"""What functional mock-up units import that version 0.1.0 wrote, by the names that it had."""

from coadjoint.simulation.steppers.fmi_instance import FmiInstance as StepperSlave
from coadjoint.simulation.steppers.fmi_instance import hold

__all__ = ["StepperSlave", "hold"]
