"""Anatomical constants of the human index finger with their sources: bones, joints and tendons.

The x axis points to the tip of the straight finger, y radially to the thumb, and z to the back of
the hand; the origin is the knuckle (MCP). Flexion and radial abduction are positive.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

JOINTS: Final = ("MCP_flexion", "MCP_abduction", "PIP_flexion", "DIP_flexion")
"""Names of the joints, in the order of all arrays over joints: knuckle (two axes), middle joint and
end joint."""

TENDONS: Final = ("FDP", "FDS", "EIP", "EDC", "LUM", "DI", "PI")
"""Names of the tendons, in the order of all arrays over tendons: flexor digitorum profundus and
superficialis, extensor indicis proprius, extensor digitorum communis, lumbrical, first dorsal and
first palmar interosseous."""

PHALANGES: Final = ("proximal", "middle", "distal")

# Fractions of a hand's length, 0.245, 0.143 and 0.097 (Buchholz, Armstrong & Goldstein 1992,
# "Anthropometric data for describing the kinematics of the human hand", Ergonomics 35:261, as
# quoted in other models), times 189 mm.
PHALANX_LENGTH_M: Final = (0.0463, 0.0270, 0.0183)
# Half the breadth of an adult's finger at each phalanx, a chosen value.
PHALANX_RADIUS_M: Final = (0.0085, 0.0075, 0.0068)
TISSUE_DENSITY: Final = 1100.0
"""Density of the finger, kg/m³, between the densities of muscle, 1060, and bone."""

JOINT_RANGE: Final[NDArray[np.float64]] = np.radians(
    [[-20.0, 90.0], [-20.0, 20.0], [0.0, 105.0], [-5.0, 80.0]]
)
"""Smallest and largest angle of each joint, rad, (4, 2): rounded active ranges of an adult. The
lower end of MCP flexion is hyperextension, 0 to 45 degrees in adults."""

DIP_BY_PIP: Final = 0.6
"""Angle of the end joint divided by the angle of the middle joint: the extensor hood and its
ligaments couple them. The value is chosen; animators use two thirds (Rijpkema & Girard 1991,
"Computer animation of knowledge-based human grasping", SIGGRAPH)."""
DIP_BAND: Final = math.radians(8.0)
"""Distance from the coupled angle within which the end joint moves freely, rad; chosen."""
DIP_COUPLING: Final = 0.15
"""Stiffness of the coupling beyond `DIP_BAND`, N·m/rad. It is chosen so that random commands keep
the end joint within 16 degrees of the coupled angle, and identification can still distinguish the
two joints."""

JOINT_REST: Final[NDArray[np.float64]] = np.radians([25.0, 0.0, 35.0, 21.0])
"""Equilibrium angles of the passive tissue, rad, chosen as in a resting, curled hand."""

# For flexion of the knuckle, 0.033 to 0.047 N·m/rad was measured in the middle of its range, in
# four healthy people (PMC7775510, table 2). The values of the other joints are chosen.
JOINT_STIFFNESS: Final[NDArray[np.float64]] = np.array([0.04, 0.04, 0.02, 0.008])
"""Passive joint stiffness around the rest angles, N·m/rad."""
END_STIFFNESS: Final = 4.0
"""Stiffness of a joint at the farther end of its range, divided by its stiffness at rest. The value
is chosen. The torque of human knuckles rises exponentially near the end (fitted by Kuo & Deshpande
2012, J. Biomechanics 45:2531); the cubic used here rises similarly."""

JOINT_DAMPING: Final[NDArray[np.float64]] = np.array([0.015, 0.015, 0.010, 0.005])
"""Passive joint damping, N·m·s/rad, chosen so that full, alternating tensions move the joints at no
more than 50 rad/s."""

JOINT_FRICTION: Final[NDArray[np.float64]] = np.array([1.0, 1.0, 0.7, 0.4]) * 1e-3
"""Coulomb friction of the joints, N·m. The values are chosen. Esteki & Mansour 1996 (J.
Biomechanics 29:443) found losses that hardly grow with speed."""

# Moment arms, mm. The laboratory of Valero-Cuevas publishes the force and torque that each tendon
# of a cadaver's index finger exerts at the fingertip (R/main.r of github.com/bc/stfeasibility), in
# an unspecified posture. FDS and DI have no moment arm at the end joint, so their forces and
# torques determine the fingertip's distance from it, 16 mm, and its flexion, 10 degrees. For the
# arms below, the knuckle and the middle joint are assumed to be flexed by 45 degrees, which other
# work of the laboratory assumes too. A different posture causes small errors. The often quoted arms
# of An et al. 1983 (J. Biomechanics 16:419) differ by up to 4 mm; see `AN_1983_ARMS`.
_MOMENT_ARMS_MM: Final = {
    "FDP": (8.6, -2.7, 4.9, 3.6),
    "FDS": (9.0, -1.3, 4.0, 0.0),
    "EIP": (-8.6, -0.3, -2.0, -0.56),
    "EDC": (-8.6, 1.1, -2.0, -0.56),
    "LUM": (6.4, 4.3, -2.3, -1.65),
    "DI": (1.9, 6.3, 0.0, 0.0),
    "PI": (3.6, -6.4, -2.3, -1.65),
}
MOMENT_ARMS: Final[NDArray[np.float64]] = np.array([_MOMENT_ARMS_MM[t] for t in TENDONS]) * 1e-3
"""Torque about each joint per newton of each tendon, m, (7, 4); zero if a tendon does not cross the
joint."""

# An, Ueba, Chao, Cooney & Linscheid 1983, "Tendon excursion and moment arm of index finger
# muscles", J. Biomechanics 16:419. The numbers are from memory, not checked in the paper.
_AN_1983_MM: Final = {
    "FDP": (11.1, 1.1, 7.9, 4.1),
    "FDS": (11.9, 1.7, 6.2, 0.0),
    "EIP": (-9.0, -1.3, -2.6, -1.9),
    "EDC": (-8.6, 0.2, -2.8, -2.2),
    "LUM": (9.3, 4.8, -1.8, -0.7),
    "DI": (3.7, 6.1, 0.0, 0.0),
    "PI": (6.6, -5.8, -2.6, -1.6),
}
AN_1983_ARMS: Final[NDArray[np.float64]] = np.array([_AN_1983_MM[t] for t in TENDONS]) * 1e-3
"""Another set of moment arms, m, (7, 4). With these arms tendons cannot balance the joints: all
tensions that extend the knuckle also move another joint, which passive tissue must hold."""

# From the file of the laboratory of Valero-Cuevas, like the moment arms.
FORCE_POTENTIAL_N: Final[NDArray[np.float64]] = np.array(
    [123.0, 219.0, 23.52, 91.74, 21.6, 124.8, 129.6]
)
"""Largest force of each muscle, N."""

# The limits, 30 % of the potential within 6 to 25 N, are chosen. Tendons of cadavers' hands have
# been pulled with 10 % (Nimbarte, Kaz & Li 2008, J. Orthopaedic Surgery and Research 3).
MOST_TENSION_N: Final[NDArray[np.float64]] = np.clip(0.3 * FORCE_POTENTIAL_N, 6.0, 25.0)
"""Largest tension of each tendon in the model, N."""

LEAST_TENSION_N: Final = 0.5
"""Smallest tension of a tendon, N, which keeps it taut."""
