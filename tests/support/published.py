"""What the paper prints of its cell, to be met character by character."""

COORDINATOR_TABLE = """\
G1: t0-1, t3-13                 start of carrying in
G2: t0-2, t1-21, t2-22, t3-23   start of loading from CV1
G3: t1-71, t3-73                end of grasp on CV1
G4: t1-81, t2-82                end of putting on MC
G5: t0-3, t1-31, t2-32          end of loading into MC
G6: t0-4, t1-41, t2-42, t3-43   start of unloading from MC
G7: t1-91, t2-92                end of grasp on MC
G8: t0-5, t1-51, t3-53          end of putting on CV2
G9: t0-6, t3-63                 end of carrying out
"""
