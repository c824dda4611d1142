# Of two groups of invented people: BCa intervals of the difference of means (boot, strata, 99,999 resamples; R's
# generator, so bounds agree to their Monte Carlo error), and the p of Welch's t over all ways to split the people.
source("../folder_common.R")
suppressMessages(library(boot))
set.seed(21)
cases <- list(
  normal_7_9 = list(round(rnorm(7, 1.2), 2), round(rnorm(9), 2)),
  skewed_6_8 = list(round(exp(rnorm(6)) + 1, 2), round(exp(rnorm(8)), 2)),
  whole_5_6 = list(c(12, 15, 9, 20, 14), c(10, 11, 11, 8, 12, 9))
)
difference <- function(x, group) mean(x[group == 1]) - mean(x[group == 2])
size_of_t <- function(x, y) abs(mean(x) - mean(y)) / sqrt(var(x) / length(x) + var(y) / length(y))
of <- function(one) {
  x <- unlist(one); group <- rep(1:2, lengths(one))
  set.seed(1)
  at <- function(x, i) difference(x[i], group[i])
  b <- boot(x, at, R = 99999, strata = group)
  influence <- empinf(data = x, statistic = at, type = "jack", stype = "i", strata = group)
  splits <- combn(length(x), length(one[[1]]))
  found <- apply(splits, 2, function(i) size_of_t(x[i], x[-i]))
  list(bca_difference = boot.ci(b, type = "bca", L = influence)$bca[4:5],
       permutation_p = mean(found >= size_of_t(one[[1]], one[[2]]) * (1 - 1e-12)), splits = ncol(splits))
}
save_data(do.call(rbind, lapply(names(cases), function(name) {
  data.frame(case = name, group = rep(1:2, lengths(cases[[name]])), value = unlist(cases[[name]]))
})))
save_expected(lapply(cases, of), "boot")
