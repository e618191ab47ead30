#!/bin/sh
# A simulator for tests: simulator.sh X RUN writes a table from X. SIM_LOG: a file that gets a line for each start.
# SIM_SECONDS: how long a run takes. SIM_FAIL, SIM_HANG: the run that exits with 7, or does not end.
if [ -n "$SIM_LOG" ]; then echo "$2" >>"$SIM_LOG"; fi
if [ "$2" = "$SIM_FAIL" ]; then echo "it does not converge" >&2; exit 7; fi
if [ "$2" = "$SIM_HANG" ]; then sleep 98765; fi
sleep "${SIM_SECONDS:-0}"
echo t,y >out.csv
awk -v x="$1" 'BEGIN { for (i = 0; i <= 10; i++) printf "%.17g,%.17g\n", i / 10, sin(x * i / 10) }' >>out.csv
