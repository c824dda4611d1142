# One-sided JZS Bayes factors of paired differences by BayesFactor (nullInterval), of invented differences.
source("../folder_common.R")
suppressMessages(library(BayesFactor))
set.seed(9)
cases <- list(
  clear_n12 = round(rnorm(12, 0.8), 3),
  none_n15 = round(rnorm(15, 0), 3),
  against_n9 = round(rnorm(9, -0.7), 3),
  three = c(0.4, 1.1, 0.9),
  strong_n20 = round(rnorm(20, 3), 3)
)
one <- function(d, r) {
  two <- extractBF(ttestBF(d, rscale = r))$bf
  sides <- extractBF(ttestBF(d, nullInterval = c(0, Inf), rscale = r))$bf
  list(bf10 = two, bf_plus0 = sides[1], bf_minus0 = sides[2])
}
save_data(do.call(rbind, lapply(names(cases), function(name) data.frame(case = name, difference = cases[[name]]))))
save_expected(lapply(cases, function(d) list(r0.707 = one(d, 0.707), r1 = one(d, 1))), "BayesFactor")
