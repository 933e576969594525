# Written by python docs/tables.py.

from ._registry import all_estimators as all_estimators
from ._registry import checked_instances as checked_instances
from .carried_force import CarriedForce as CarriedForce
from .conformal_regressor import ConformalRegressor as ConformalRegressor
from .conformal_regressor import PredictionInterval as PredictionInterval
from .cylinder_force import CylinderForce as CylinderForce
from .forward_model import ForwardAnswer as ForwardAnswer
from .forward_model import ForwardModel as ForwardModel
from .full_fine_tuning import FullFineTuning as FullFineTuning
from .gap_diagnoser import GapDiagnoser as GapDiagnoser
from .geometric_flow import GeometricFlow as GeometricFlow
from .geometric_force import GeometricForce as GeometricForce
from .hosovsky_hybrid import HosovskyHybrid as HosovskyHybrid
from .inverse_model import InverseModel as InverseModel
from .inverse_model import PressureAnswer as PressureAnswer
from .inverted_force import InvertedForce as InvertedForce
from .joint_drive import JointDrive as JointDrive
from .joint_pihm import JointPIHM as JointPIHM
from .law_regressor import LawRegressor as LawRegressor
from .lifted_load import LiftedLoad as LiftedLoad
from .linear_state_space import LinearStateSpace as LinearStateSpace
from .lora import LoRA as LoRA
from .mlp import MLP as MLP
from .nnarx import NNARX as NNARX
from .nonlinear_elastic import NonlinearElastic as NonlinearElastic
from .online_adapter import OnlineAdapter as OnlineAdapter
from .partial_fine_tuning import PartialFineTuning as PartialFineTuning
from .polynomial_flow import PolynomialFlow as PolynomialFlow
from .polynomial_force import PolynomialForce as PolynomialForce
from .polynomial_narx import PolynomialNARX as PolynomialNARX
from .q_adapter import QAdapter as QAdapter
from .rates import RateTransformer as RateTransformer
from .recurrent import Recurrent as Recurrent
from .residual_hybrid import ResidualHybrid as ResidualHybrid
from .scale_adapter import ScaleAdapter as ScaleAdapter
from .sindy import SINDyRegressor as SINDyRegressor
from .sindy_model import SINDyModel as SINDyModel
from .static_force_map import StaticForceMap as StaticForceMap
from .static_pihm import StaticPIHM as StaticPIHM
from .thermodynamic_pihm import ThermodynamicPIHM as ThermodynamicPIHM
from .three_element import LiftRun as LiftRun
from .three_element import ThreeElement as ThreeElement
from .transfer_function import TransferFunction as TransferFunction

__all__ = [
    "MLP",
    "NNARX",
    "CarriedForce",
    "ConformalRegressor",
    "CylinderForce",
    "ForwardAnswer",
    "ForwardModel",
    "FullFineTuning",
    "GapDiagnoser",
    "GeometricFlow",
    "GeometricForce",
    "HosovskyHybrid",
    "InverseModel",
    "InvertedForce",
    "JointDrive",
    "JointPIHM",
    "LawRegressor",
    "LiftRun",
    "LiftedLoad",
    "LinearStateSpace",
    "LoRA",
    "NonlinearElastic",
    "OnlineAdapter",
    "PartialFineTuning",
    "PolynomialFlow",
    "PolynomialForce",
    "PolynomialNARX",
    "PredictionInterval",
    "PressureAnswer",
    "QAdapter",
    "RateTransformer",
    "Recurrent",
    "ResidualHybrid",
    "SINDyModel",
    "SINDyRegressor",
    "ScaleAdapter",
    "StaticForceMap",
    "StaticPIHM",
    "ThermodynamicPIHM",
    "ThreeElement",
    "TransferFunction",
    "all_estimators",
    "checked_instances",
]
