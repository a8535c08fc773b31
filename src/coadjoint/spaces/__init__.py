"""What a group acts on, and the diamond (mathematics: section 2)."""

from coadjoint.spaces.action import Action
from coadjoint.spaces.by_inverse import ByInverse
from coadjoint.spaces.group_itself import GroupItself
from coadjoint.spaces.links import Links
from coadjoint.spaces.named import Named
from coadjoint.spaces.relative_poses import RelativePoses
from coadjoint.spaces.representations import Adjoint, Coadjoint, Defining, Dual, Points, Representation, Trivial
from coadjoint.spaces.several import Several
from coadjoint.spaces.space import Space
from coadjoint.spaces.sphere import Sphere
from coadjoint.spaces.submanifold import Submanifold

__all__ = [
    "Action",
    "Adjoint",
    "ByInverse",
    "Coadjoint",
    "Defining",
    "Dual",
    "GroupItself",
    "Links",
    "Named",
    "Points",
    "RelativePoses",
    "Representation",
    "Several",
    "Space",
    "Sphere",
    "Submanifold",
    "Trivial",
]
