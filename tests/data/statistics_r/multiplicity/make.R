# p.adjust of three families.
source("../folder_common.R")
families <- list(mixed = c(0.001, 0.04, 0.03, 0.2, 0.0005, 0.9, 0.049), tied = c(0.02, 0.02, 0.01, 0.5, 0.01), one = 0.03)
save_data(do.call(rbind, lapply(names(families), function(name) data.frame(family = name, p = families[[name]]))))
methods <- c("holm", "bonferroni", "BH", "BY", "hochberg", "hommel")
save_expected(lapply(families, function(p) c(list(p = I(p)), setNames(lapply(methods, function(m) I(p.adjust(p, m))), methods))))
