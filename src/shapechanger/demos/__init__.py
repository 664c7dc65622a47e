"""Demonstrations: recording, reading and exchanging episodes, and policies cloned from them.

```
episodes/      the format on disk: write, read, repair, edit and merge episodes
recording.py   record a Gymnasium env that publishes layouts
drivers.py     drivers of recordings: an expert, a policy, or a policy with corrections
dataset.py     episodes as NumPy arrays
report.py      the page of a recording
replay.py      play an episode in an env, or as a film
jpeg.py        images, and actions drawn below them
exchange/      import and export: csv, minari, tub, lerobot; export only: mcap
cloning/       behaviour cloning
```
"""
