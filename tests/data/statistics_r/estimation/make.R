# BCa intervals (boot, 99,999 resamples; R's generator, so bounds agree to their Monte Carlo error), the exact paired
# permutation test (exactRankTests), and Cousineau-Morey intervals written out, of invented values.
source("../folder_common.R")
suppressMessages({library(boot); library(exactRankTests)})
set.seed(14)
two <- function(n, shift, draw) cbind(round(draw(n) + shift, 2), round(draw(n), 2))
cases <- list(
  normal_n12 = two(12, 0.8, rnorm),
  skewed_n14 = two(14, 0.5, function(n) exp(rnorm(n))),
  whole_n10 = cbind(c(12, 15, 9, 20, 14, 11, 18, 16, 13, 17), c(10, 15, 11, 14, 12, 12, 13, 15, 9, 12))
)
bounds <- function(d, statistic, seed) {
  set.seed(seed)
  at <- function(x, i) statistic(x[i])
  b <- boot(d, at, R = 99999)
  boot.ci(b, type = "bca", L = empinf(data = d, statistic = at, type = "jack", stype = "i"))$bca[4:5]
}
three <- cbind(round(rnorm(9, 10, 3), 2), 0, 0)
three[, 2] <- round(three[, 1] + rnorm(9, 1), 2); three[, 3] <- round(three[, 1] + rnorm(9, 2, 2), 2)
morey <- function(m) {
  n <- nrow(m); k <- ncol(m)
  y <- m - rowMeans(m) + mean(m)
  se <- apply(y, 2, sd) / sqrt(n) * sqrt(k / (k - 1))
  lapply(seq_len(k), function(j) mean(m[, j]) + c(-1, 1) * qt(0.975, n - 1) * se[j])
}
save_data(rbind(
  do.call(rbind, lapply(names(cases), function(name) {
    m <- cases[[name]]
    data.frame(case = name, participant = as.vector(row(m)), condition = as.vector(col(m)), value = as.vector(m))
  })),
  data.frame(case = "three_conditions", participant = as.vector(row(three)), condition = as.vector(col(three)), value = as.vector(three))
))
save_expected(c(lapply(cases, function(m) {
  d <- m[, 1] - m[, 2]
  list(bca_difference = bounds(d, mean, 1), bca_dz = bounds(d, function(x) mean(x) / sd(x), 2),
       permutation_p = perm.test(round(100 * m[, 1]), round(100 * m[, 2]), paired = TRUE, exact = TRUE)$p.value,
       morey = morey(m))
}), list(three_conditions = list(morey = morey(three)))), c("boot", "exactRankTests"))
