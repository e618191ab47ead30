# f = u/(100 a + b u) for u = 0 .. 99: awk -f hyperbola.awk A B
BEGIN {
    print "u f" > "hyperbola.txt"
    for (u = 0; u < 100; u++) printf "%d %.17g\n", u, u / (100 * ARGV[1] + ARGV[2] * u) > "hyperbola.txt"
}
