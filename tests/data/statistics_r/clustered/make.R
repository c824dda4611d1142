# Errors (0 or 1) and counts of many trials a person. Estimates and robust standard errors by geepack (independence);
# Mancl and DeRouen's by clubSandwich, whose CR3 of a generalized linear model is that.
source("../folder_common.R")
suppressMessages({library(geepack); library(clubSandwich)})
set.seed(31)
people <- function(n, conditions, trials, draw) do.call(rbind, lapply(seq_len(n), function(i) {
  person <- rnorm(1)
  do.call(rbind, lapply(seq_along(conditions), function(j) {
    count <- trials(i)
    data.frame(participant = i, condition = conditions[j], draw(person + rnorm(1, 0, 0.3), j, count))
  }))
}))
errors <- function(base) function(person, j, count) data.frame(outcome = rbinom(count, 1, plogis(base[j] + person)), exposure = 1)
counts <- function(base) function(person, j, count) {
  exposure <- round(runif(count, 1, 5), 2)
  data.frame(outcome = rnbinom(count, size = 3, mu = exposure * exp(base[j] + 0.5 * person)), exposure = exposure)
}
cases <- list(
  errors_two = people(12, c("a", "b"), function(i) 8, errors(c(-1.5, -0.3))),
  errors_three_unequal = people(11, c("a", "b", "c"), function(i) 4 + i %% 5, errors(c(-1, -0.5, 0.2))),
  counts_two = people(10, c("a", "b"), function(i) 3, counts(c(0.5, 0))),
  counts_three_unequal = people(9, c("a", "b", "c"), function(i) 2 + i %% 3, counts(c(0.3, 0, -0.4)))
)
fit <- function(name) {
  d <- cases[[name]]; k <- length(unique(d$condition)); n <- length(unique(d$participant))
  family <- if (startsWith(name, "errors")) binomial() else poisson()
  d$off <- log(d$exposure)
  gee <- geeglm(outcome ~ condition - 1 + offset(off), id = participant, data = d, family = family, corstr = "independence")
  plain <- glm(outcome ~ condition - 1 + offset(off), data = d, family = family, control = glm.control(epsilon = 1e-14))
  v <- as.matrix(vcovCR(plain, cluster = d$participant, type = "CR3"))
  robust <- vcov(gee); beta <- coef(plain)
  pairs <- combn(k, 2)
  rows <- apply(pairs, 2, function(ij) {
    w <- rep(0, k); w[ij] <- c(1, -1)
    est <- sum(w * beta); se <- sqrt(drop(w %*% v %*% w)); df <- n - k
    list(log_ratio = est, se = se, se_uncorrected = sqrt(drop(w %*% robust %*% w)), t = est / se, df = df,
         p = 2 * pt(-abs(est / se), df), ratio = exp(est), ci = exp(est + c(-1, 1) * qt(0.975, df) * se))
  })
  q <- k - 1
  contrasts <- cbind(1, -diag(q))
  wald <- drop(t(contrasts %*% beta) %*% solve(contrasts %*% v %*% t(contrasts)) %*% (contrasts %*% beta))
  df <- n - k; f <- wald * (df - q + 1) / (q * df)
  list(geepack = unname(coef(gee)), estimates = unname(beta), pairs = rows, F = f, df1 = q, df2 = df - q + 1,
       F_p = pf(f, q, df - q + 1, lower.tail = FALSE),
       dispersion = sum(residuals(plain, "pearson")^2) / (nrow(d) - k))
}
save_data(do.call(rbind, lapply(names(cases), function(name) cbind(case = name, cases[[name]]))))
save_expected(setNames(lapply(names(cases), fit), names(cases)), c("geepack", "clubSandwich"))
