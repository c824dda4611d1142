# Tests of groups of participants: Welch's t and ANOVA, Games-Howell, Levene, Mann-Whitney, Kruskal-Wallis.
source("tests/data/statistics_r/common.R")
suppressPackageStartupMessages({
  library(car); library(coin); library(effectsize); library(exactRankTests)
})
packages <- c("car", "coin", "effectsize", "exactRankTests", "jsonlite")

frame_of <- function(groups) {
  sizes <- lengths(groups)
  data.frame(
    participant = sprintf("P%02d", seq_len(sum(sizes))),
    group = rep(names(groups), sizes),
    value = unlist(groups, use.names = FALSE)
  )
}

levene <- function(data, center) {
  found <- leveneTest(value ~ factor(group, unique(group)), data, center = center)
  list(F = found[1, "F value"], df1 = found[1, "Df"], df2 = found[2, "Df"], p = found[1, "Pr(>F)"])
}

# Newcombe (2006), Statistics in Medicine 25, 559-573, method 5, with the variance reduced for ties as the test's is.
newcombe <- function(x, y) {
  m <- length(x); n <- length(y); total <- m + n
  ranks <- rank(c(x, y)); counts <- table(ranks)
  ties <- 1 - sum(counts^3 - counts) / (total^3 - total)
  theta <- mean(outer(x, y, function(a, b) (a > b) + (a == b) / 2))
  variance <- function(t) ties * t * (1 - t) * (1 + (total / 2 - 1) * ((1 - t) / (2 - t) + t / (1 + t))) / (m * n)
  beyond <- function(t) (theta - t)^2 - qnorm(0.975)^2 * variance(t)
  low <- if (theta <= 0) 0 else uniroot(beyond, c(0, min(theta, 1 - 1e-12)), tol = 1e-14)$root
  high <- if (theta >= 1) 1 else uniroot(beyond, c(max(theta, 1e-12), 1), tol = 1e-14)$root
  2 * c(low, high) - 1
}

two_groups <- function(x, y) {
  data <- frame_of(list(a = x, b = y)); data$group <- factor(data$group)
  welch <- t.test(x, y)
  d <- cohens_d(x, y); g <- hedges_g(x, y); av <- cohens_d(x, y, pooled_sd = FALSE)
  exact <- coin::wilcox_test(value ~ group, data, distribution = "exact")
  approximate <- coin::wilcox_test(value ~ group, data, distribution = "asymptotic")
  shift <- suppressWarnings(wilcox.test(x, y, exact = TRUE, conf.int = TRUE))
  tied <- anyDuplicated(c(x, y)) > 0
  list(
    welch = list(t = welch$statistic[[1]], df = welch$parameter[[1]], p = welch$p.value, ci = welch$conf.int[1:2]),
    cohens_ds = c(d$Cohens_d, d$CI_low, d$CI_high),
    hedges_gs = c(g$Hedges_g, g$CI_low, g$CI_high),
    d_av = c(av$Cohens_d, av$CI_low, av$CI_high),
    mann_whitney = list(
      U = shift$statistic[[1]],
      p_exact = pvalue(exact)[[1]],
      p_exact_ranktests = wilcox.exact(x, y)$p.value,
      p_asymptotic = pvalue(approximate)[[1]],
      p_without_ties = if (tied) NULL else shift$p.value,
      shift = median(outer(x, y, "-")),
      shift_ci = if (tied) NULL else shift$conf.int[1:2],
      rank_biserial = rank_biserial(x, y)$r_rank_biserial,
      rank_biserial_ci = newcombe(x, y)
    )
  )
}

several_groups <- function(data) {
  data$group <- factor(data$group, unique(data$group))
  welch <- oneway.test(value ~ group, data)
  f <- welch$statistic[[1]]; df <- welch$parameter
  eta <- F_to_eta2(f, df[[1]], df[[2]], alternative = "two.sided")
  means <- tapply(data$value, data$group, mean)
  variances <- tapply(data$value, data$group, var)
  sizes <- tapply(data$value, data$group, length)
  pairs <- combn(levels(data$group), 2, simplify = FALSE)
  games_howell <- lapply(pairs, function(pair) {
    share <- variances[pair] / sizes[pair]
    error <- sqrt(sum(share)); difference <- means[[pair[1]]] - means[[pair[2]]]
    df <- sum(share)^2 / sum(share^2 / (sizes[pair] - 1))
    margin <- qtukey(0.95, length(sizes), df) / sqrt(2) * error
    list(
      contrast = paste(pair, collapse = " - "), difference = difference, t = difference / error, df = df,
      p = ptukey(sqrt(2) * abs(difference / error), length(sizes), df, lower.tail = FALSE),
      ci = c(difference - margin, difference + margin)
    )
  })
  kruskal <- kruskal.test(value ~ group, data)
  on_ranks <- summary(aov(rank(value) ~ group, data))[[1]]
  ranked <- F_to_eta2(on_ranks[1, "F value"], on_ranks[1, "Df"], on_ranks[2, "Df"], alternative = "two.sided")
  list(
    anova_welch = list(
      F = f, df1 = df[[1]], df2 = df[[2]], p = welch$p.value,
      partial_eta_squared = c(eta$Eta2_partial, eta$CI_low, eta$CI_high)
    ),
    games_howell = games_howell,
    levene = levene(data, mean),
    brown_forsythe = levene(data, median),
    kruskal = list(
      H = kruskal$statistic[[1]], df = kruskal$parameter[[1]], p = kruskal$p.value,
      rank_epsilon_squared = rank_epsilon_squared(value ~ group, data = data, ci = NULL)$rank_epsilon_squared,
      rank_eta_squared = rank_eta_squared(value ~ group, data = data, ci = NULL)$rank_eta_squared,
      epsilon_squared_ci = c(ranked$CI_low, ranked$CI_high)
    )
  )
}

set.seed(20)
two <- list(
  groups2_unequal = list(round(rnorm(9, 42, 6), 2), round(rnorm(14, 35, 13), 2)),
  groups2_small = list(round(rnorm(4, 5, 2), 3), round(rnorm(7, 8, 2), 3)),
  groups2_tied = list(sample(1:7, 8, TRUE), sample(3:7, 10, TRUE)),
  groups2_apart = list(c(8.1, 9.4, 7.7, 10.2), c(3.3, 2.9, 5.1, 4.8, 6.0))
)
for (name in names(two)) {
  groups <- setNames(two[[name]], c("a", "b"))
  data <- frame_of(groups)
  write_case(name, data, c(two_groups(groups$a, groups$b), several_groups(data)), packages)
}
several <- list(
  groups4_unequal = list(
    novice = round(rnorm(6, 30, 4), 2), some = round(rnorm(9, 33, 9), 2),
    more = round(rnorm(12, 36, 5), 2), expert = round(rnorm(5, 41, 2), 2)
  ),
  groups3_tied = list(a = sample(1:5, 7, TRUE), b = sample(2:6, 9, TRUE), c = sample(3:7, 6, TRUE))
)
for (name in names(several)) write_case(name, frame_of(several[[name]]), several_groups(frame_of(several[[name]])), packages)
