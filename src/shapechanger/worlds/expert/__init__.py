"""Expert driving with full knowledge of the course: planned paths, a driver and disturbances."""

from __future__ import annotations

from shapechanger.worlds.expert.disturbance import Disturbance
from shapechanger.worlds.expert.driver import CourseExpert
from shapechanger.worlds.expert.line import CourseProgress
from shapechanger.worlds.expert.path import CoursePath, plan_path

__all__ = ["CourseExpert", "CoursePath", "CourseProgress", "Disturbance", "plan_path"]
