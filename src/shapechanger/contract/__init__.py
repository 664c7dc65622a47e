"""The promises of an env to learners, studies and recorders.

`env_ref` names an env as a value and reads its traits: layouts, measures, and the optional
abilities that transfer uses (an expert, a family of bodies, a certificate of a shift). `measure`
defines how well a task is done. `testing` is the exam of every env; begin there to write a new one.
"""
