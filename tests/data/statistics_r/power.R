# Power by R's own functions where it has them, by its noncentral distributions and integrate() where not.
source("tests/data/statistics_r/common.R")

two_tails <- function(delta, df, alpha = 0.05) {
  critical <- qt(alpha / 2, df, lower.tail = FALSE)
  pt(critical, df, delta, lower.tail = FALSE) + pt(-critical, df, delta)
}

welch <- function(d, n, sd_ratio, size_ratio) {
  sizes <- c(n, size_ratio * n); variances <- c(1, sd_ratio^2); shares <- variances / mean(variances) / sizes
  two_tails(d / sqrt(sum(shares)), sum(shares)^2 / sum(shares^2 / (sizes - 1)))
}

several <- function(f, n, sds) {
  k <- length(sds); weights <- n / (sds^2 / mean(sds^2))
  means <- c(f * sqrt(k / 2), rep(0, k - 2), -f * sqrt(k / 2))
  lambda <- sum(weights * (means - weighted.mean(means, weights))^2)
  df2 <- (k^2 - 1) / (3 * sum((1 - weights / sum(weights))^2 / (n - 1)))
  pf(qf(0.95, k - 1, df2), k - 1, df2, lambda, lower.tail = FALSE)
}

factorial <- function(f, people, cells, df1, df2, share, epsilon = 1) {
  lambda <- epsilon * people * cells * f^2 / share
  pf(qf(0.95, epsilon * df1, epsilon * df2), epsilon * df1, epsilon * df2, lambda, lower.tail = FALSE)
}

equivalence <- function(bound, effect, error, df, alpha = 0.05) {
  critical <- qt(1 - alpha, df)
  density <- function(s) 2 * s * df * dchisq(s^2 * df, df)
  inside <- function(s) density(s) * (pnorm((bound - effect) / error - critical * s) - pnorm((-bound - effect) / error + critical * s))
  integrate(inside, 0, bound / (critical * error), rel.tol = 1e-11, subdivisions = 2000)$value
}

write_case("power", data.frame(none = character(0)), list(power = list(
  two_groups_r = power.t.test(n = 20, delta = 0.5, sd = 1, strict = TRUE)$power,
  two_groups_n_r = power.t.test(power = 0.8, delta = 0.5, sd = 1, strict = TRUE)$n,
  two_groups_effect_r = power.t.test(n = 20, power = 0.8, sd = 1, strict = TRUE)$delta,
  welch_unequal = welch(0.7, 12, 2, 2),
  one_way_r = power.anova.test(groups = 4, n = 15, between.var = 0.3^2 * 4 / 3, within.var = 1)$power,
  welch_anova = several(0.4, 15, c(1, 2, 3)),
  welch_anova_equal = several(0.3, 12, rep(1, 4)),
  within_2x3_interaction = factorial(0.2, 18, 6, 2, 34, 0.5),
  within_epsilon = factorial(0.25, 15, 4, 3, 42, 0.4, 0.7),
  mixed_between = factorial(0.3, 24, 3, 1, 22, 1 + 2 * 0.6),
  mixed_within = factorial(0.2, 24, 3, 2, 44, 0.4),
  mixed_interaction = factorial(0.2, 24, 3, 2, 44, 0.4, 0.8),
  equivalence_paired = equivalence(0.6, 0, sqrt(1 / 30), 29),
  equivalence_shifted = equivalence(0.6, 0.2, sqrt(1 / 20), 19),
  equivalence_groups = equivalence(0.8, 0.1, sqrt(2 / 25), 48)
)), "jsonlite")
