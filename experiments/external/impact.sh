#!/bin/sh
# A particle hits a plate: linear spring and dashpot, the closed-form solution.
#
#   impact.sh STIFFNESS DAMPING        [N/m] and [N s/m]
#
# Writes, into the folder it runs in, the force over time (force.txt) and the coefficient of restitution
# (rebound.json). It stands for a DEM program of yours: a plan calls either in the same way.
set -eu
awk -v k="$1" -v c="$2" 'BEGIN {
    mass = 1e-6; speed = 0.5; pi = atan2(0, -1)
    beta = c / (2 * mass)
    omega2 = k / mass - beta * beta
    if (omega2 <= 0) { print "overdamped: the particle does not come back" > "/dev/stderr"; exit 3 }
    omega = sqrt(omega2)
    contact = pi / omega
    print "time_s force_n" > "force.txt"
    for (i = 0; i <= 200; i++) {
        t = 2e-4 * i / 200
        force = 0
        if (t < contact) {
            x = speed / omega * exp(-beta * t) * sin(omega * t)
            v = speed * exp(-beta * t) * (cos(omega * t) - beta / omega * sin(omega * t))
            force = k * x + c * v
        }
        printf "%.9e %.9e\n", t, force > "force.txt"
    }
    printf "{\"restitution\": %.9e}\n", exp(-beta * contact) > "rebound.json"
}'
