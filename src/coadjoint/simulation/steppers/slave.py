"""Names imported by functional mock-up units that version 0.1.0 wrote."""

from coadjoint.simulation.steppers.fmi_instance import FmiInstance as StepperSlave
from coadjoint.simulation.steppers.fmi_instance import hold

__all__ = ["StepperSlave", "hold"]
