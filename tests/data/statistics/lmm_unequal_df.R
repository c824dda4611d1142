# What lmerTest makes of models whose contrasts have degrees of freedom of their own: Rscript tests/data/statistics/lmm_unequal_df.R
#
# The data are invented. In each case most people met all conditions but the last, and some met only that one: contrasts
# within people and the one between people then rest on different degrees of freedom, which the F test combines (Fai and
# Cornelius 1996). Where one of them is 2 or less, lmerTest takes 2 for the whole.
#
# The combination depends on how the hypothesis is written. With two terms lmerTest writes it as each level minus the
# first, as Steadyhand does; with one term alone it takes sequential contrasts of the design, and another combination.
suppressMessages({library(lmerTest); library(jsonlite)})

folder <- dirname(sub("--file=", "", grep("--file=", commandArgs(), value = TRUE)))

by_name <- function(table, columns) {
  lapply(split(table, factor(rownames(table), rownames(table))), function(row) {
    setNames(as.list(as.numeric(row)), columns)
  })
}

for (case in c("lmm_unequal_df_n8", "lmm_df_below_two_n3")) {
  data <- read.csv(file.path(folder, case, "data.csv"))
  data$condition <- factor(data$condition)
  model <- lmer(value ~ condition + period + (1 | participant), data)
  hypotheses <- cbind(0, diag(nlevels(data$condition) - 1), 0)
  directions <- t(eigen(hypotheses %*% as.matrix(vcov(model)) %*% t(hypotheses))$vectors) %*% hypotheses
  anova <- as.data.frame(anova(model))[, c("F value", "NumDF", "DenDF", "Pr(>F)")]
  versions <- c(R = R.version.string, platform = R.version$platform,
                sapply(c("lme4", "lmerTest", "jsonlite"), function(name) as.character(packageVersion(name))))
  expected <- list(
    case = case,
    difference_direction = "first condition in file order minus second",
    levels_order = list(condition = levels(data$condition), task = I("main")),
    lmm_condition_period = list(
      formula = "value ~ condition + period + (1 | participant)",
      n_obs = nobs(model),
      n_groups = unname(ngrps(model)),
      singular = isSingular(model),
      fixed = by_name(coef(summary(model)), c("estimate", "se", "df_satterthwaite", "t", "p")),
      anova_type3_satterthwaite = by_name(anova, c("F", "df1", "df2", "p")),
      df_of_single_directions = apply(directions, 1, function(row) contest1D(model, row)$df),
      var_participant = as.data.frame(VarCorr(model))$vcov[1],
      var_residual = sigma(model)^2,
      reml_criterion = unname(REMLcrit(model))
    ),
    versions = as.list(versions)
  )
  path <- file.path(folder, case, "expected.json")
  writeLines(toJSON(expected, auto_unbox = TRUE, digits = NA, pretty = 1), path)
}
