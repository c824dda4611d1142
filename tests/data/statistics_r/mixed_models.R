# Mixed models with random intercepts of participant, participant:condition and target, by lmerTest.
source("tests/data/statistics_r/common.R")
suppressPackageStartupMessages(library(lmerTest))
packages <- c("lme4", "lmerTest", "jsonlite")
tight <- lmerControl(optimizer = "bobyqa", optCtrl = list(rhoend = 1e-10), check.conv.singular = "ignore")

fitted_model <- function(formula, data) {
  fit <- suppressMessages(lmer(formula, data, control = tight))
  variances <- as.data.frame(VarCorr(fit))
  coefficients <- as.data.frame(coef(summary(fit)))
  anova <- as.data.frame(anova(fit))
  list(
    formula = deparse1(formula), singular = isSingular(fit), reml_criterion = REMLcrit(fit),
    variances = setNames(as.list(variances$vcov), variances$grp),
    fixed = setNames(lapply(seq_len(nrow(coefficients)), function(i) {
      setNames(as.list(coefficients[i, ]), c("estimate", "se", "df", "t", "p"))
    }), rownames(coefficients)),
    anova = setNames(lapply(seq_len(nrow(anova)), function(i) {
      list(F = anova[i, "F value"], df1 = anova[i, "NumDF"], df2 = anova[i, "DenDF"], p = anova[i, "Pr(>F)"])
    }), rownames(anova))
  )
}

invented <- function(people, conditions, targets, trials, sd, kept = 1) {
  data <- expand.grid(
    trial = seq_len(trials), target = sprintf("t%d", seq_len(targets)), condition = conditions,
    person = seq_len(people), stringsAsFactors = FALSE
  )
  number <- match(data$condition, conditions); target <- match(data$target, unique(data$target))
  cell <- (data$person - 1) * length(conditions) + number
  data$participant <- sprintf("P%02d", data$person)
  data$value <- round(
    20 + 0.6 * number + rnorm(people, 0, sd[["participant"]])[data$person] +
      rnorm(people * length(conditions), 0, sd[["cell"]])[cell] + rnorm(targets, 0, sd[["target"]])[target] +
      rnorm(nrow(data), 0, sd[["residual"]]), 2
  )
  data <- data[sort(sample(nrow(data), round(kept * nrow(data)))), ]
  data[c("participant", "condition", "target", "trial", "value")]
}

write_models <- function(name, data, formulas) {
  read <- data
  for (column in c("participant", "condition", "target")) read[[column]] <- factor(read[[column]], unique(read[[column]]))
  write_case(name, data, list(models = lapply(formulas, fitted_model, read)), packages)
}

set.seed(47)
nested <- list(
  value ~ condition + (1 | participant) + (1 | participant:condition),
  value ~ condition + target + (1 | participant) + (1 | participant:condition)
)
crossed <- list(
  value ~ condition + (1 | participant) + (1 | participant:condition) + (1 | target),
  value ~ condition + (1 | participant) + (1 | target)
)
write_models(
  "models_balanced", invented(10, c("A", "B"), 5, 1, list(participant = 2, cell = 1, target = 1, residual = 0.7)),
  c(nested, crossed)
)
write_models(
  "models_unbalanced",
  invented(9, c("A", "B", "C"), 4, 3, list(participant = 3, cell = 1.5, target = 0.8, residual = 2), 0.6),
  c(nested, crossed, value ~ condition * target + (1 | participant) + (1 | participant:condition))
)
write_models(
  "models_singular", invented(8, c("A", "B"), 4, 2, list(participant = 1, cell = 0, target = 0, residual = 2), 0.9),
  c(nested, crossed)
)
