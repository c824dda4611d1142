# Ratios of geometric means: t tests of logarithms taken back by the exponential, and the analysis of variance of logs.
source("tests/data/statistics_r/common.R")
suppressPackageStartupMessages(library(afex))
packages <- c("afex", "jsonlite")

ratio <- function(x, y, paired) {
  found <- t.test(log(x), log(y), paired = paired)
  difference <- if (paired) mean(log(x) - log(y)) else mean(log(x)) - mean(log(y))
  list(t = found$statistic[[1]], df = found$parameter[[1]], p = found$p.value, ratio = exp(difference), ci = exp(found$conf.int[1:2]))
}

set.seed(61)
people <- 10
data <- expand.grid(task = c("near", "far"), condition = c("A", "B", "C"), person = seq_len(people), stringsAsFactors = FALSE)
data$value <- round(exp(rnorm(people, 2, 0.4)[data$person] + 0.3 * match(data$condition, c("A", "B", "C")) +
  (data$task == "far") + rnorm(nrow(data), 0, 0.3)), 2)
data$participant <- sprintf("P%02d", data$person)
data <- data[c("participant", "condition", "task", "value")]
cell <- function(condition, task) data$value[data$condition == condition & data$task == task]
averaged <- function(condition) exp((log(cell(condition, "near")) + log(cell(condition, "far"))) / 2)
near <- cell("A", "near")
interval <- t.test(log(near))$conf.int[1:2]
anova <- as.data.frame(suppressMessages(aov_ez("participant", "value", within(data, value <- log(value)), within = c("condition", "task"), anova_table = list(correction = "none")))$anova_table)
write_case("log_3x2_n10", data, list(
  paired = ratio(cell("A", "near"), cell("B", "near"), TRUE),
  welch = ratio(cell("A", "near")[1:6], cell("C", "far"), FALSE),
  condition_pairs = list(
    ratio(averaged("A"), averaged("B"), TRUE), ratio(averaged("A"), averaged("C"), TRUE), ratio(averaged("B"), averaged("C"), TRUE)
  ),
  rm_anova_log = setNames(lapply(rownames(anova), function(effect) list(F = anova[effect, "F"], p = anova[effect, "Pr(>F)"], ges = anova[effect, "ges"])), rownames(anova)),
  geometric_mean = c(exp(mean(log(near))), exp(interval))
), packages)
