# McNemar's test (base R) and Cochran's Q (the generalized Mantel-Haenszel test over participants, base R; exactly by
# writing out every order of every participant's answers) of invented answers 0 or 1.
source("../folder_common.R")
set.seed(5)
answers <- function(n, p) sapply(p, function(one) rbinom(n, 1, one))
cases <- list(
  two_n14 = answers(14, c(0.75, 0.3)),
  two_n30 = answers(30, c(0.4, 0.6)),
  two_one_way = cbind(c(1, 1, 1, 1, 1, 1, 0, 1), c(0, 0, 0, 0, 0, 1, 0, 0)),
  three_n10 = answers(10, c(0.8, 0.5, 0.3)),
  four_n8 = answers(8, c(0.9, 0.6, 0.5, 0.3))
)
mcnemar <- function(m) {
  b <- sum(m[, 1] > m[, 2]); c <- sum(m[, 1] < m[, 2]); n <- nrow(m)
  exact <- binom.test(b, b + c)
  chi2 <- mcnemar.test(matrix(c(sum(m[, 1] & m[, 2]), c, b, sum(!m[, 1] & !m[, 2])), 2), correct = FALSE)
  one <- (b + 1) / (n + 2); other <- (c + 1) / (n + 2)
  list(b = b, c = c, p = exact$p.value, mid_p = exact$p.value - dbinom(b, b + c, 0.5),
       odds_ratio_ci = as.vector(exact$conf.int / (1 - exact$conf.int)),
       chi2 = unname(chi2$statistic), chi2_p = chi2$p.value,
       bonett_price = one - other + c(-1, 1) * qnorm(0.975) * sqrt((one + other - (one - other)^2) / (n + 2)))
}
permutations <- function(v) {
  if (length(v) == 1) return(matrix(v, 1))
  unique(do.call(rbind, lapply(seq_along(v), function(i) cbind(v[i], permutations(v[-i])))))
}
exact_q <- function(m) {
  found <- sum(colSums(m)^2)
  sums <- matrix(0, 1, ncol(m)); weight <- 1
  for (i in seq_len(nrow(m))) {
    p <- permutations(m[i, ])
    sums <- do.call(rbind, lapply(seq_len(nrow(p)), function(j) sweep(sums, 2, p[j, ], "+")))
    weight <- rep(weight, nrow(p)) / nrow(p)
    key <- apply(sums, 1, paste, collapse = " ")
    weight <- as.vector(tapply(weight, key, sum)); sums <- sums[match(sort(unique(key)), key), , drop = FALSE]
  }
  sum(weight[rowSums(sums^2) >= found])
}
q <- function(m) {
  frame <- data.frame(answer = as.vector(m), condition = factor(as.vector(col(m))), person = factor(as.vector(row(m))))
  t <- mantelhaen.test(table(frame$condition, frame$answer, frame$person)[, , apply(m, 1, function(r) length(unique(r)) > 1)])
  list(Q = unname(t$statistic), chi2_p = t$p.value, exact_p = exact_q(m))
}
save_data(do.call(rbind, lapply(names(cases), function(name) {
  m <- cases[[name]]
  data.frame(case = name, participant = as.vector(row(m)), condition = as.vector(col(m)), answer = as.vector(m))
})))
save_expected(lapply(cases, function(m) if (ncol(m) == 2) mcnemar(m) else q(m)))
