"""Demonstrations: recording, reading and exchanging episodes, and policies cloned from them.

```
episodes/      the format on disk; standard library only, because robots record too
recording.py   record any Gymnasium env
drivers.py     who drives while recording: an expert, a policy, or a policy with corrections
dataset.py     episodes as NumPy arrays
statistics.py  summaries and distributions for reports
merging.py     copy episodes of several recordings into one
overlay.py     draw an action below its picture
exchange/      import and export: csv, minari, tub, lerobot, mcap
cloning/       behaviour cloning
```
"""
