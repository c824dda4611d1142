# Mixed analysis of variance, one between-factor with unequal groups: type III as afex has it, and what follows it up.
source("tests/data/statistics_r/common.R")
suppressPackageStartupMessages({
  library(afex); library(car); library(effectsize); library(emmeans)
})
packages <- c("afex", "car", "effectsize", "emmeans", "jsonlite")
afex_options(check_contrasts = TRUE, emmeans_model = "multivariate")

t_row <- function(x, y, paired) {
  found <- t.test(x, y, paired = paired)
  list(t = found$statistic[[1]], df = found$parameter[[1]], p = found$p.value)
}

row_of <- function(fit, effect) {
  anova <- anova(fit, correction = "none", es = c("ges", "pes"))[effect, ]
  eta <- F_to_eta2(anova$F, anova$`num Df`, anova$`den Df`, alternative = "two.sided")
  row <- list(
    F = anova$F, df1 = anova$`num Df`, df2 = anova$`den Df`, p = anova$`Pr(>F)`, generalized_eta2 = anova$ges,
    partial_eta2 = anova$pes, partial_eta2_ci = c(eta$CI_low, eta$CI_high)
  )
  corrected <- suppressWarnings(summary(fit$Anova, multivariate = FALSE))
  if (effect %in% rownames(corrected$sphericity.tests)) {
    mauchly <- corrected$sphericity.tests[effect, ]
    epsilon <- corrected$pval.adjustments[effect, ]
    row <- c(row, list(
      mauchly_w = mauchly[[1]], mauchly_p = mauchly[[2]], epsilon_gg = epsilon[["GG eps"]],
      p_gg = epsilon[["Pr(>F[GG])"]], epsilon_hf = min(1, epsilon[["HF eps"]]),
      p_hf = if (epsilon[["HF eps"]] > 1) row$p else epsilon[["Pr(>F[HF])"]]
    ))
  }
  row
}

averaged_pairs <- function(fit, specs, by = NULL) {
  found <- as.data.frame(pairs(emmeans(fit, specs, by = by), adjust = "none"))
  lapply(seq_len(nrow(found)), function(i) as.list(found[i, ]))
}

analysed <- function(data, within) {
  for (name in c("group", within)) data[[name]] <- factor(data[[name]], unique(data[[name]]))
  fit <- suppressMessages(aov_ez("participant", "value", data, between = "group", within = within, type = 3))
  effects <- rownames(fit$anova_table)
  people <- aggregate(value ~ participant + group, data, mean)
  levene <- leveneTest(value ~ group, people, center = median)
  single <- length(within) == 1
  list(
    effects = setNames(lapply(effects, function(effect) row_of(fit, effect)), effects),
    brown_forsythe_of_means = list(F = levene[1, "F value"], p = levene[1, "Pr(>F)"]),
    condition_pairs = averaged_pairs(fit, "condition"),
    condition_at_task = if (single) NULL else averaged_pairs(fit, "condition", "task"),
    within_groups = if (single) lapply(levels(data$group), function(group) {
      at <- data[data$group == group, ]
      wide <- reshape(at[c("participant", "condition", "value")], idvar = "participant", timevar = "condition", direction = "wide")
      found <- combn(2:ncol(wide), 2, function(pair) t_row(wide[[pair[1]]], wide[[pair[2]]], TRUE), simplify = FALSE)
      list(group = group, pairs = found)
    }),
    between_groups = if (single) lapply(levels(data$condition), function(condition) {
      at <- split(data$value[data$condition == condition], data$group[data$condition == condition])
      list(condition = condition, pairs = combn(at, 2, function(pair) t_row(pair[[1]], pair[[2]], FALSE), simplify = FALSE))
    }),
    groups = combn(split(people$value, people$group), 2, function(pair) t_row(pair[[1]], pair[[2]], FALSE), simplify = FALSE)
  )
}

invented <- function(sizes, conditions, tasks, spreads) {
  group <- rep(names(sizes), sizes)
  people <- seq_along(group)
  data <- expand.grid(task = tasks, condition = conditions, person = people, stringsAsFactors = FALSE)
  intercept <- rnorm(length(people), 40, 6); slope <- rnorm(length(people), 0, 3)
  number <- match(data$condition, conditions); group_number <- match(group[data$person], names(sizes))
  mean <- intercept[data$person] + number * slope[data$person] + 3 * number * (group_number - 1) +
    2 * match(data$task, tasks) + 4 * group_number
  data.frame(
    participant = sprintf("P%02d", data$person), group = group[data$person], condition = data$condition,
    task = data$task, value = round(mean + rnorm(nrow(data), 0, spreads[number]), 2)
  )
}

set.seed(31)
write_mixed <- function(name, data, within) write_case(name, data, analysed(data, within), packages)
write_mixed("mixed_3_of_8_and_7", invented(c(novice = 8, expert = 7), c("A", "B", "C"), "t", c(2, 4, 7)), "condition")
write_mixed("mixed_2_of_6_and_11", invented(c(novice = 6, expert = 11), c("A", "B"), "t", c(3, 3)), "condition")
write_mixed(
  "mixed_2x3_of_5_7_and_6", invented(c(low = 5, middle = 7, high = 6), c("A", "B"), c("near", "mid", "far"), c(3, 5)),
  c("condition", "task")
)
write_mixed("mixed_4_of_4_9_and_5", invented(c(a = 4, b = 9, c = 5), c("A", "B", "C", "D"), "t", c(2, 3, 5, 8)), "condition")
