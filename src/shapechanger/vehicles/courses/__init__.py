"""Courses: laid out as values (`layout`), and drawn as surfaces with light (`scene`)."""
