"""Expert driving with full knowledge of the course: planned paths, a driver and disturbances."""

from __future__ import annotations

from shapechanger.vehicles.expert.disturbance import Disturbance
from shapechanger.vehicles.expert.driver import CourseExpert
from shapechanger.vehicles.expert.line import CourseProgress
from shapechanger.vehicles.expert.path import CoursePath, plan_path

__all__ = ["CourseExpert", "CoursePath", "CourseProgress", "Disturbance", "plan_path"]
