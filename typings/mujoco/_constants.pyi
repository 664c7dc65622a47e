import builtins
import collections.abc
import typing
import numpy.typing
import mujoco._specs
__all__: list[str] = ['MJTNUM_BYTES', 'mjDISABLESTRING', 'mjENABLESTRING', 'mjFRAMESTRING', 'mjLABELSTRING', 'mjMAXCONPAIR', 'mjMAXFLEXNODES', 'mjMAXIMP', 'mjMAXLIGHT', 'mjMAXLINE', 'mjMAXLINEPNT', 'mjMAXOVERLAY', 'mjMAXPLANEGRID', 'mjMAXTREEDEPTH', 'mjMAXVAL', 'mjMINAWAKE', 'mjMINIMP', 'mjMINMU', 'mjMINVAL', 'mjNBIAS', 'mjNDYN', 'mjNEQDATA', 'mjNFLUID', 'mjNGAIN', 'mjNGROUP', 'mjNIMP', 'mjNISLAND', 'mjNPOLY', 'mjNREF', 'mjNSENS', 'mjNSOLVER', 'mjPI', 'mjRNDSTRING', 'mjSC_IN', 'mjSC_INOUT', 'mjSC_OUT', 'mjTIMERSTRING', 'mjVERSION_HEADER', 'mjVISSTRING']
MJTNUM_BYTES: int
mjDISABLESTRING: builtins.tuple[typing.Any, ...]
mjENABLESTRING: builtins.tuple[typing.Any, ...]
mjFRAMESTRING: builtins.tuple[typing.Any, ...]
mjLABELSTRING: builtins.tuple[typing.Any, ...]
mjMAXCONPAIR: int
mjMAXFLEXNODES: int
mjMAXIMP: float
mjMAXLIGHT: int
mjMAXLINE: int
mjMAXLINEPNT: int
mjMAXOVERLAY: int
mjMAXPLANEGRID: int
mjMAXTREEDEPTH: int
mjMAXVAL: float
mjMINAWAKE: int
mjMINIMP: float
mjMINMU: float
mjMINVAL: float
mjNBIAS: int
mjNDYN: int
mjNEQDATA: int
mjNFLUID: int
mjNGAIN: int
mjNGROUP: int
mjNIMP: int
mjNISLAND: int
mjNPOLY: int
mjNREF: int
mjNSENS: int
mjNSOLVER: int
mjPI: float
mjRNDSTRING: builtins.tuple[typing.Any, ...]
mjSC_IN: int
mjSC_INOUT: int
mjSC_OUT: int
mjTIMERSTRING: builtins.tuple[typing.Any, ...]
mjVERSION_HEADER: int
mjVISSTRING: builtins.tuple[typing.Any, ...]
