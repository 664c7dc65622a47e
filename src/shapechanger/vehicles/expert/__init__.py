"""Expert driving with full knowledge of the course: planned paths, progress and a driver."""

from __future__ import annotations

from shapechanger.vehicles.expert.driver import CourseExpert
from shapechanger.vehicles.expert.line import CourseProgress
from shapechanger.vehicles.expert.path import CoursePath, plan_path

__all__ = ["CourseExpert", "CoursePath", "CourseProgress", "plan_path"]
