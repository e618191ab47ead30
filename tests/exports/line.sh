#!/bin/sh
# y = a + b t, and its double.
awk -v a="$1" -v b="$2" 'BEGIN { print "t,y,double"; for (k = 0; k <= 40; k++) { t = k / 10; printf "%.17g,%.17g,%.17g\n", t, a + b * t, 2 * (a + b * t) } }' > out.csv
