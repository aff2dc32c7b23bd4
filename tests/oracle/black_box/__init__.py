"""A black box that answers for a project file without any of sealag's analysis.

It shares the controller's `tick` with sealag, because that is what runs, and nothing else: the
project file, the URDF, contacts, springs and drives are read again, the tick is differentiated
numerically at the equilibrium where the loop rests, and roots are found with SciPy.
"""
