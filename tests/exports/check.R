# Reads the exports of runs by rstan and posterior, and compares what they find with expected.csv: Rscript check.R EXPORTS
suppressMessages({ library(rstan); library(posterior) })
exports <- commandArgs(TRUE)[1]
file <- function(name) file.path(exports, name)
expected <- read.csv(file("expected.csv"), row.names = "name")
near <- function(found, wanted, what) {
  if (!isTRUE(all.equal(found, wanted, tolerance = 1e-9))) stop(what, ": ", found, " for ", wanted)
}
fit <- read_stan_csv(file("posterior-stan.csv"))
draws <- as_draws_df(read.csv(file("posterior-draws.csv"), check.names = FALSE))
names <- setdiff(rownames(expected), "elpd_loo")
for (name in names) {
  of <- list(rstan = extract(fit, name, permuted = FALSE)[, 1, 1], posterior = as.vector(extract_variable(draws, name)))
  for (reader in names(of)) {
    values <- of[[reader]]
    near(mean(values), expected[name, "mean"], paste(reader, "mean of", name))
    near(sd(values), expected[name, "sd"], paste(reader, "sd of", name))
    ends <- quantile(values, c(0.05, 0.95), names = FALSE)
    near(ends, unlist(expected[name, c("q05", "q95")], use.names = FALSE), paste(reader, "quantiles of", name))
  }
}
log_lik <- loo::extract_log_lik(fit)
stopifnot(nrow(log_lik) == ndraws(draws), nchains(draws) == 1)
if ("elpd_loo" %in% rownames(expected)) {
  elpd <- suppressWarnings(loo::loo(log_lik, r_eff = rep(1, ncol(log_lik))))$estimates["elpd_loo", "Estimate"]
  if (abs(elpd - expected["elpd_loo", "mean"]) > 0.2) stop("elpd_loo: ", elpd)
}
cat(basename(dirname(exports)), ": rstan ", format(packageVersion("rstan")), ", posterior ", format(packageVersion("posterior")),
  ", ", nrow(log_lik), " draws\n", sep = "")
