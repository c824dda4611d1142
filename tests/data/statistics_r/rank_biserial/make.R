# The rank-biserial correlation and its interval, written out: the jackknife by leaving one participant out after the
# other, the exact p by every sign of the midranks.
source("../folder_common.R")
set.seed(12)
cases <- list(
  normal_n12 = round(rnorm(12, 0.5), 3),
  not_significant_n9 = round(rnorm(9, 0.1), 3),
  ratings_n14 = sample(-2:4, 14, TRUE),
  ratings_with_zeros_n10 = c(2, 1, 0, 1, 3, -1, 0, 2, 2, 1),
  negative_n11 = round(rnorm(11, -0.9), 2),
  of_one_sign_n6 = c(1, 2, 2, 4, 5, 6),
  of_one_sign_n5 = c(-1, -2, -2, -4, -5),
  one_against_n16 = c(-0.1, seq(0.2, 1.6, by = 0.1)),
  contradicted_n12 = c(-1.2, 0.9, 1.1, 1.5, 2.1, 0.4, -0.3, 1.9, 2.4, 1.3, -0.8, 1.6)
)
parts <- function(d, zeros) {
  if (zeros == "dropped") d <- d[d != 0]
  r <- rank(abs(d))
  list(sum = sum(sign(d) * r), total = sum(r))
}
r_of <- function(d, zeros) { p <- parts(d, zeros); if (p$total == 0) 0 else p$sum / p$total }
exact_p <- function(d, zeros) {
  r <- if (zeros == "dropped") rank(abs(d[d != 0])) else rank(abs(d))[d != 0]
  w <- sum(r[d[d != 0] > 0])
  all <- as.vector(as.matrix(expand.grid(rep(list(0:1), length(r)))) %*% r)
  min(1, 2 * min(mean(all <= w + 1e-9), mean(all >= w - 1e-9)))
}
interval <- function(d, zeros) {
  n <- length(d); m <- sum(d != 0); r <- r_of(d, zeros); p <- exact_p(d, zeros)
  without <- sapply(seq_len(n), function(i) r_of(d[-i], zeros))
  se <- sd(n * r - (n - 1) * without) / sqrt(n)
  half <- qt(0.975, n - 1) * se / (1 - r^2)
  bound <- 2 * 0.025^(1 / m) - 1
  ci <- if (r == 1) c(bound, 1) else if (r == -1) c(-1, -bound) else tanh(atanh(r) + c(-1, 1) * half)
  jackknife <- ci
  ci <- c(min(ci[1], bound), max(ci[2], -bound))
  step <- 1 / parts(d, zeros)$total
  if (p >= 0.05) ci <- c(min(ci[1], 0), max(ci[2], 0))
  else if (r > 0) ci[1] <- max(ci[1], step)
  else ci[2] <- min(ci[2], -step)
  list(r = r, p = p, se = se, jackknife = jackknife, ci = ci)
}
save_data(do.call(rbind, lapply(names(cases), function(name) data.frame(case = name, difference = cases[[name]]))))
save_expected(lapply(cases, function(d) list(dropped = interval(d, "dropped"), pratt = interval(d, "pratt"))))
