# ART-C (Elkin, Kay, Higgins and Wobbrock 2021) by hand: ARTool is not at hand here. For the pairs of an effect its
# factors are one factor S: residual beside the cell means plus the mean of the level of S, ranked; then paired t tests of
# participants' mean ranks.
source("tests/data/statistics_r/common.R")
packages <- c("jsonlite")

aligned_ranks <- function(data, of) {
  cell <- ave(data$value, data$condition, data$task)
  level <- do.call(ave, c(list(data$value), data[of]))
  rank(round(data$value - cell + level - mean(data$value), 9))
}

pairs_of <- function(data, of, at = NULL) {
  data$rank <- aligned_ranks(data, c(of, at))
  places <- if (is.null(at)) list(data) else split(data, factor(data[[at]], unique(data[[at]])))
  unlist(lapply(places, function(part) {
    means <- aggregate(part["rank"], part[c("participant", of)], mean)
    combn(unique(data[[of]]), 2, function(pair) {
      means <- means[order(means$participant), ]
      x <- means$rank[means[[of]] == pair[1]]; y <- means$rank[means[[of]] == pair[2]]
      found <- t.test(x, y, paired = TRUE)
      where <- if (is.null(at)) "" else paste(" |", unique(part[[at]]))
      list(list(
        effect = paste(c(of, at), collapse = ":"), contrast = paste0(pair[1], " - ", pair[2], where),
        t = found$statistic[[1]], df = found$parameter[[1]], p = found$p.value, dz = mean(x - y) / sd(x - y)
      ))
    }, simplify = FALSE)
  }), recursive = FALSE)
}

flat <- function(found) unname(lapply(found, function(one) one[[1]]))

invented <- function(people, conditions, tasks, ordinal) {
  data <- expand.grid(task = tasks, condition = conditions, person = seq_len(people), stringsAsFactors = FALSE)
  number <- match(data$condition, conditions)
  mean <- rnorm(people, 3, 0.5)[data$person] + 0.4 * number + 0.3 * (data$task == "far") * number
  value <- mean + rnorm(nrow(data), 0, 0.7)
  data$value <- if (ordinal) pmin(7, pmax(1, round(value))) else round(exp(value), 1)
  data$participant <- sprintf("P%02d", data$person)
  data[c("participant", "condition", "task", "value")]
}

set.seed(53)
two <- invented(11, c("A", "B", "C"), c("near", "far"), FALSE)
write_case("artc_3x2_n11", two, list(art_contrasts = c(flat(pairs_of(two, "condition")), flat(pairs_of(two, "condition", "task")))), packages)
ratings <- invented(9, c("A", "B", "C"), c("near", "far"), TRUE)
write_case("artc_ratings_n9", ratings, list(art_contrasts = c(flat(pairs_of(ratings, "condition")), flat(pairs_of(ratings, "condition", "task")))), packages)
