# Recomputes comparisons in R. Reads problems.csv and values.csv in the working folder and appends to answers.csv what
# each function says, a row per figure. All names in these files are neutral (participant 0, f1, level 0): nothing that
# a study says is run as code. A function that stops is a row with its message, and the others go on.

problems <- read.csv("problems.csv", na.strings = "NA", colClasses = c(factors = "character", terms = "character"))
values <- read.csv("values.csv")
installed <- function(name) requireNamespace(name, quietly = TRUE)
suppressWarnings(suppressMessages(loaded <- sapply(c("afex", "lmerTest", "BayesFactor"), installed)))

say <- function(problem, call, name, value, message = "") {
  row <- data.frame(problem, call, name, value = sprintf("%.17g", value), message)
  write.table(row, "answers.csv", append = TRUE, sep = ",", row.names = FALSE, col.names = FALSE, qmethod = "double")
}

answer <- function(problem, call, figures) {
  tryCatch({
    found <- suppressWarnings(suppressMessages(figures()))
    for (name in names(found)) say(problem, call, name, as.numeric(found[[name]]))
  }, error = function(stop) say(problem, call, "", NA_real_, gsub("[\r\n]+", " ", conditionMessage(stop))))
}

of_t <- function(test) list(statistic = test$statistic, df2 = test$parameter, p = test$p.value,
                            ci_difference_low = test$conf.int[1], ci_difference_high = test$conf.int[2])
of_chi2 <- function(test) list(statistic = test$statistic, df1 = test$parameter, p = test$p.value)

# The row of an effect, whichever order its factors are named in; of aov, among the tables of all error strata.
row_of <- function(table, effect) {
  ordered <- function(name) paste(sort(strsplit(trimws(name), ":", fixed = TRUE)[[1]]), collapse = ":")
  at <- which(sapply(rownames(table), ordered) == ordered(effect))
  if (length(at)) table[at[1], , drop = FALSE] else NULL
}

of_aov <- function(fit, effect) {
  for (stratum in summary(fit)) {
    table <- as.data.frame(stratum[[1]])
    row <- row_of(table, effect)
    if (!is.null(row) && "F value" %in% names(row)) {
      return(list(statistic = row[["F value"]], df1 = row[["Df"]], df2 = table[nrow(table), "Df"], p = row[["Pr(>F)"]]))
    }
  }
  stop("no F value of the effect")
}

of_afex <- function(data, between, within, effect) {
  fit <- afex::aov_ez("participant", "value", data, between = between, within = within)
  row <- row_of(as.data.frame(fit$anova_table), effect)
  list(statistic = row[["F"]], df1 = row[["num Df"]], df2 = row[["den Df"]], p = row[["Pr(>F)"]], effect_size = row[["ges"]])
}

with_factors <- function(data, names) {
  for (name in c("participant", names)) data[[name]] <- factor(data[[name]])
  data
}

anova_of <- function(id, data, within, between, effect) {
  data <- with_factors(data, c(within, between))
  inside <- paste(within, collapse = "*")
  model <- paste(c(between, inside), collapse = "*")
  formula <- as.formula(sprintf("value ~ %s + Error(participant/(%s))", model, inside))
  answer(id, "summary(aov(value ~ … + Error(participant/…)))", function() of_aov(aov(formula, data), effect))
  if (loaded[["afex"]]) answer(id, "afex::aov_ez(id, dv, data, …)", function() of_afex(data, between, within, effect))
}

mixed_model <- function(id, problem, data) {
  factors <- strsplit(problem$factors, " ")[[1]]
  if (!loaded[["lmerTest"]]) return(invisible())
  data <- with_factors(data, factors)
  formula <- as.formula(sprintf("value ~ %s + (1 | participant)", gsub(" ", " + ", problem$terms)))
  answer(id, "anova(lmerTest::lmer(value ~ … + (1 | participant)))", function() {
    model <- lmerTest::lmer(formula, data)
    row <- row_of(as.data.frame(anova(model)), problem$effect)
    list(statistic = row[["F value"]], df1 = row[["NumDF"]], df2 = row[["DenDF"]], p = row[["Pr(>F)"]],
         log_likelihood = logLik(model))
  })
}

for (at in seq_len(nrow(problems))) {
  problem <- problems[at, ]
  id <- problem$problem
  data <- values[values$problem == id, ]
  x <- data$value[data$g == 0]
  y <- data$value[data$g == 1]
  within <- strsplit(problem$factors, " ")[[1]]
  switch(problem$procedure,
    t_paired = answer(id, "t.test(x, y, paired = TRUE)", function() of_t(t.test(x, y, paired = TRUE))),
    t_welch = answer(id, "t.test(x, y)", function() of_t(t.test(x, y))),
    wilcoxon = answer(id, "wilcox.test(x, y, paired = TRUE)", function() {
      test <- wilcox.test(x, y, paired = TRUE)
      list(statistic = test$statistic, p = test$p.value)
    }),
    mann_whitney = answer(id, "wilcox.test(x, y)", function() {
      test <- wilcox.test(x, y)
      list(statistic = test$statistic, p = test$p.value)
    }),
    tost = answer(id, "t.test(x, y, paired = TRUE, mu, alternative), twice", function() {
      sides <- list(t.test(x, y, paired = TRUE, mu = problem$low, alternative = "greater"),
                    t.test(x, y, paired = TRUE, mu = problem$high, alternative = "less"))
      weaker <- sides[[which.max(sapply(sides, function(side) side$p.value))]]
      list(statistic = weaker$statistic, df2 = weaker$parameter, p = weaker$p.value)
    }),
    bayes_t = if (loaded[["BayesFactor"]]) answer(id, "BayesFactor::ttestBF(x, y, paired = TRUE)", function() {
      scale <- if (is.na(problem$scale)) "medium" else problem$scale
      factor <- BayesFactor::ttestBF(x, y, paired = TRUE, rscale = scale)
      list(statistic = BayesFactor::extractBF(factor)$bf)
    }),
    friedman = answer(id, "friedman.test(value ~ f1 | participant)", function()
      of_chi2(friedman.test(data$value, data$f1, data$participant))),
    kruskal = answer(id, "kruskal.test(value ~ g)", function() of_chi2(kruskal.test(data$value, data$g))),
    anova_welch = answer(id, "oneway.test(value ~ g)", function() {
      test <- oneway.test(value ~ g, data)
      list(statistic = test$statistic, df1 = test$parameter[1], df2 = test$parameter[2], p = test$p.value)
    }),
    rm_anova = anova_of(id, data, within, NULL, problem$effect),
    mixed_anova = anova_of(id, data, within, "g", problem$effect),
    mixed_model = mixed_model(id, problem, data),
    p_adjusted = answer(id, "p.adjust(p, method)", function()
      list(p_adjusted = p.adjust(data$value, problem$method)[problem$place]))
  )
}
