# What a run changes in LAMMPS's own example in.pour: the damping and friction of all contacts, and a smaller box.
s/^\(pair_style.*NULL\) 50\.0 NULL 0\.5 0/\1 {{damping}} NULL {{friction}} 0/
s/^\(fix.*zlower.*NULL\) 50\.0 NULL 0\.5 0/\1 {{damping}} NULL {{friction}} 0/
s/-10 10 -10 10 -0\.5 16/-5 5 -5 5 -0.5 16/
s/-9\.0 9\.0 -9\.0 9\.0/-4.5 4.5 -4.5 4.5/
s/pour 3000 1 /pour 400 1 /
s/^\(run.*\)25000/\110000/
s/^\(thermo[^_].*\)1000$/\1500/
